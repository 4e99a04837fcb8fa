"""Requirements on errors due to the step in an archive: JSON in the attribute `step_errors` of an experiment's group,
if its deck has any."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping

from batch.archive.stored import StoredGroup, Unlike
from met.host.files import parse_json
from met.plan.judged import StepErrorLimit

ATTRIBUTE = "step_errors"

FIELDS = {"text": str, "metric": str, "comparison": str, "limit": float, "share": bool}
"""The fields of each requirement, with their types."""


def written(limits: Iterable[StepErrorLimit], names: Mapping[str, str]) -> str:
    """The value of the attribute. names: of the metrics' variables, by the metrics' own"""
    plain = [{name: getattr(limit, name) for name in FIELDS} | {"metric": names[limit.metric]} for limit in limits]
    return json.dumps(plain, sort_keys=True, separators=(",", ":"))


def read(group: StoredGroup) -> Iterator[StepErrorLimit]:
    """The requirements of a group; their metrics are names of variables. Raises Unlike."""
    text = group.attributes.get(ATTRIBUTE, "[]")
    try:
        plain = parse_json(text) if isinstance(text, str) else None
    except ValueError:
        plain = None
    if not isinstance(plain, list):
        raise Unlike(f"attribute `{ATTRIBUTE}` is no list of requirements")
    metrics = {variable.name for variable in group.role("metric")}
    for entry in plain:
        good = isinstance(entry, dict) and all(type(entry.get(name)) is kind for name, kind in FIELDS.items())
        if (
            not good
            or entry["metric"] not in metrics
            or entry["comparison"] not in ("<", "<=")
            or not entry["limit"] > 0
        ):
            raise Unlike(f"attribute `{ATTRIBUTE}` is no list of requirements")
        yield StepErrorLimit(**{name: entry[name] for name in FIELDS})
