"""An MCAP export, read by the official reader: the arm is where the archive says, and everything says what it is."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.export import export
from met import cli
from met import run as engine
from met.diagnostic import Problem
from met.dynamics.kinematics import link_motions
from met.program.system import System
from met.vectors import quaternion
from tests.batch import plans
from tests.batch.arms.solids import binary_stl, box
from tests.batch.export.decks import CHAIN, DECK, LINKS, Mcap, made, matrix, said

MESHED = """\
arm one {
    link bar { mass = 1 kg;  shape = box(size = [1, 1, 1] m); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo held { model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }
run hold {
    arm = one;  servos { hinge = held; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 0.1 s;  record = [q];
}
"""


@pytest.fixture(scope="module")
def pick(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[ArchiveFile, Mcap]]:
    """A run's archive, and its export."""
    archive = made(tmp_path_factory.mktemp("pick"), "pick")
    with ArchiveFile(archive) as file:
        yield file, Mcap(export(archive).path)


@pytest.fixture(scope="module")
def reaches(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[ArchiveFile, Mcap]]:
    """The same of a sweep, whose third case was asked for first."""
    archive = made(tmp_path_factory.mktemp("reaches"), "reaches")
    with ArchiveFile(archive) as file:
        yield file, Mcap(export(archive, cases=["#2", 0, "#1", 2]).path)


@pytest.mark.slow
def test_the_frames_are_where_the_archive_has_the_links(pick: tuple[ArchiveFile, Mcap]) -> None:
    file, read = pick
    group = file.groups[0]
    worlds = list(read.worlds("/tf"))
    assert len(worlds) == 51 and set(worlds[0]) == set(LINKS)
    for link in LINKS:
        found = np.array([world[link] for world in worlds])
        kept = group.signal(f"links.{link}.position", 0)
        np.testing.assert_allclose(found[:, :3, 3], kept, rtol=0, atol=1e-12)
        turns = group.signal(f"links.{link}.orientation", 0)
        for world, (w, x, y, z) in zip(found, turns, strict=True):
            kept_turn = matrix(_Numbers(0, 0, 0), _Numbers(x, y, z, w))
            np.testing.assert_allclose(world[:3, :3], kept_turn[:3, :3], rtol=0, atol=1e-12)


@pytest.mark.release
def test_the_frames_are_where_the_kinematics_have_them(reaches: tuple[ArchiveFile, Mcap]) -> None:
    file, read = reaches
    [experiment] = file.plan().experiments
    for case, reach in enumerate((0.8, 1.1, 0.5)):
        outputs = experiment.formulas.replay({"reach": reach})
        values = {
            path: outputs[q.value.output] if hasattr(q.value, "output") else q.value
            for path, q in experiment.parameters.items()
        }
        tree = System(experiment).tree(lambda name, values=values: float(values[name.removeprefix("parameter:")]))
        history = file.groups[0].signal("q", case)
        for q, world in zip(history, read.worlds(f"/case{case}/tf"), strict=True):
            for link, motion in link_motions(tree, q.tolist(), [0.0] * 5).items():
                w, x, y, z = quaternion(motion.pose.R)
                wanted = matrix(_Numbers(*motion.pose.p), _Numbers(x, y, z, w))
                np.testing.assert_allclose(world[f"case{case}/{link}"], wanted, rtol=0, atol=1e-12)
        far = next(iter(read.worlds(f"/case{case}/tf")))[f"case{case}/wrist"][:3, 3]
        np.testing.assert_allclose(far, file.groups[0].signal("links.wrist.position", case)[0], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_no_frame_jumps_between_the_two_quaternions_of_its_turn(pick: tuple[ArchiveFile, Mcap]) -> None:
    _, read = pick
    turns = np.array(
        [
            [[turn.rotation.w, turn.rotation.x, turn.rotation.y, turn.rotation.z] for turn in message.data.transforms]
            for message in read.of("/tf")
        ]
    )
    assert (turns[0, :, 0] >= 0.0).all() and (turns[..., 0] < 0.0).any()  # the lamp passes half a turn
    assert (np.sum(turns[1:] * turns[:-1], axis=-1) > 0.0).all()


@pytest.mark.slow
def test_the_clock_is_the_simulated_time_from_zero_in_order(pick: tuple[ArchiveFile, Mcap]) -> None:
    _, read = pick
    assert [message.time for message in read.of("/tf")] == [20_000_000 * row for row in range(51)]
    assert [message.time for message in read.messages] == sorted(message.time for message in read.messages)
    for message in (*read.of("/tf"), *read.of("/log")):
        stamps = [message.data] if message.topic == "/log" else message.data.transforms
        assert {stamp.timestamp.ToNanoseconds() for stamp in stamps} == {message.time}


@pytest.mark.slow
def test_a_signal_is_a_topic_with_a_field_for_each_joint_and_component(pick: tuple[ArchiveFile, Mcap]) -> None:
    file, read = pick
    group = file.groups[0]
    joints = ("lift", "swing", "roll", "point", "pan")
    rates = [[getattr(message.data, joint) for joint in joints] for message in read.of("/qd")]
    np.testing.assert_array_equal(rates, group.signal("qd", 0))
    forces = [
        [[getattr(getattr(message.data, joint), axis) for axis in "xyz"] for joint in joints]
        for message in read.of("/reaction/force")
    ]
    np.testing.assert_array_equal(forces, group.signal("reaction.force", 0))
    tips = [[getattr(message.data, axis) for axis in "xyz"] for message in read.of("/links/tool/position")]
    np.testing.assert_array_equal(tips, group.signal("links.tool.position", 0))
    commands = [message.data.value for message in read.of("/swing/servo/command")]
    np.testing.assert_array_equal(commands, group.signal("swing.servo.command", 0))


def test_a_channel_says_its_unit_or_that_of_each_joint(pick: tuple[ArchiveFile, Mcap]) -> None:
    _, read = pick
    assert read.channels["/swing/servo/command"].metadata == {
        "unit": "rad/s^2",
        "about": "acceleration command of the servo",
    }
    assert read.channels["/tau"].metadata == {
        "unit.lift": "N",
        "unit.swing": "N*m",
        "unit.roll": "N*m",
        "unit.point": "N*m",
        "unit.pan": "N*m",
        "about": "torque of the servo on the joint",
    }


@pytest.mark.slow
def test_only_the_signals_that_are_asked_for_are_there(pick: tuple[ArchiveFile, Mcap], tmp_path: Path) -> None:
    file, _ = pick
    names = ["swing.qd", "roll.qd", "tool.x", "links.tool.position.z"]
    with pytest.raises(Problem, match="E324"):
        export(file.path, tmp_path / "a.mcap", signals=names)
    names.remove("tool.x")
    read = Mcap(export(file.path, tmp_path / "a.mcap", signals=names).path)
    assert read.topics() == {"/tf", "/scene", "/log", "/result", "/qd", "/links/tool/position"}
    assert [field.name for field in read.of("/qd")[0].data.DESCRIPTOR.fields] == ["swing", "roll"]
    assert [field.name for field in read.of("/links/tool/position")[0].data.DESCRIPTOR.fields] == ["z"]


def test_a_link_looks_as_the_deck_says_and_moves_with_its_frame(pick: tuple[ArchiveFile, Mcap]) -> None:
    _, read = pick
    drawn = read.entities("/scene")
    assert set(drawn) == {"base", *LINKS}
    assert all(entity.frame_locked and entity.frame_id == name for name, entity in drawn.items() if name != "base")
    [stand] = drawn["stand"].cubes
    assert (stand.size.x, stand.size.y, stand.size.z) == (0.2, 0.3, 0.4)
    assert (stand.pose.position.x, stand.pose.position.y, stand.pose.position.z) == (0.0, 0.0, 0.2)
    boom, joint = drawn["boom"].cylinders
    assert (boom.size.x, boom.size.y, boom.size.z) == (0.08, 0.08, 0.8)
    np.testing.assert_allclose(_ends(boom), [[0, 0, 0], [0.8, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(np.mean(_ends(joint), axis=0), [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.diff(_ends(joint), axis=0)[0] / joint.size.z, [0, -1, 0], atol=1e-12)
    rod, _ = drawn["pointer"].cylinders
    np.testing.assert_allclose(_ends(rod), [[0, 0, 0], [0, 0.3, 0]], atol=1e-12)
    [lamp] = drawn["lamp"].spheres
    assert (lamp.size.x, lamp.size.y, lamp.size.z) == (0.12, 0.12, 0.12)
    assert {each.key: each.value for each in drawn["lamp"].metadata} == {
        "link": "lamp",
        "mass": "1.5 kg",
        "shape": "sphere",
    }
    assert len(drawn["carriage"].cubes) == 2  # itself, and its prismatic joint
    colours = [
        (entity.cubes or entity.cylinders or entity.spheres)[0].color
        for entity in drawn.values()
        if entity.id in ("stand", "carriage", "boom", "pointer")
    ]
    assert len({(colour.r, colour.g, colour.b) for colour in colours}) == 4
    assert {colour.a for colour in colours} == {1.0}


def test_a_link_without_a_shape_is_lines_to_its_joints_or_to_its_centre_of_mass(
    pick: tuple[ArchiveFile, Mcap],
) -> None:
    drawn = pick[1].entities("/scene")
    [wrist] = drawn["wrist"].lines
    assert [(p.x, p.y, p.z) for p in wrist.points] == [(0, 0, 0), (0.1, 0, 0), (0, 0, 0), (0, 0, 0.2)]
    [tool] = drawn["tool"].lines
    assert [(p.x, p.y, p.z) for p in tool.points] == [(0, 0, 0), (0, 0, 0.1)]
    assert drawn["tool"].spheres[0].pose.position.z == 0.1
    [stand] = drawn["base"].lines
    assert drawn["base"].frame_id == "world"
    assert [(p.x, p.y, p.z) for p in stand.points] == [(0, 0, 0), (0, 0.1, 0)]


def test_a_solid_is_where_its_mass_is(pick: tuple[ArchiveFile, Mcap]) -> None:
    [lamp] = pick[1].entities("/scene")["lamp"].spheres
    assert (lamp.pose.position.x, lamp.pose.position.y, lamp.pose.position.z) == (0.1, 0.0, 0.0)


@pytest.mark.release
def test_a_solid_whose_inertia_is_written_is_only_a_look(tmp_path: Path) -> None:
    boom = "link boom     { mass = 5 kg;  com = [0.7, 0, 0] m;  inertia = [0.1, 1, 1] kg*m^2;"
    read = Mcap(export(made(tmp_path, "pick", DECK.replace("link boom     { mass = 5 kg;", boom))).path)
    drawn = read.entities("/scene")["boom"].cylinders[0]
    np.testing.assert_allclose(_ends(drawn), [[0, 0, 0], [0.8, 0, 0]], atol=1e-12)


def test_a_joint_that_slides_has_a_rail_as_long_as_it_moves(pick: tuple[ArchiveFile, Mcap]) -> None:
    file, read = pick
    far = file.groups[0].signal("q", 0)[:, 0].max()
    [rail] = read.entities("/scene")["stand"].lines
    assert far == pytest.approx(0.05, rel=1e-3)
    np.testing.assert_allclose([(p.x, p.y, p.z) for p in rail.points], [(0, 0, 0.4), (0, 0, 0.4 + far)], atol=1e-15)


@pytest.mark.slow
def test_several_cases_are_overlaid_the_first_solid_and_the_others_as_ghosts(
    reaches: tuple[ArchiveFile, Mcap],
) -> None:
    _, read = reaches
    opacity = {case: read.entities(f"/case{case}/scene")[f"case{case}/boom"].cylinders[0].color.a for case in range(3)}
    assert opacity[2] == 1.0 and opacity[0] == opacity[1] < 0.5
    parents = {each.parent_frame_id for each in read.of("/case1/tf")[0].data.transforms}
    assert parents == {"world", "case1/stand", "case1/carriage", "case1/boom", "case1/wrist"}
    assert [name for name, _ in read.metadata] == ["met.export", "met.case", "met.case", "met.case"]
    assert [data["prefix"] for name, data in read.metadata[1:]] == ["case2/", "case0/", "case1/"]
    assert {"/case0/qd", "/case1/qd", "/case2/qd", "/log"} < read.topics()
    assert "/case0/log" not in read.topics()


@pytest.mark.slow
def test_a_length_that_follows_from_what_is_varied_is_the_cases_own(reaches: tuple[ArchiveFile, Mcap]) -> None:
    _, read = reaches
    lengths = [read.entities(f"/case{case}/scene")[f"case{case}/boom"].cylinders[0].size.z for case in range(3)]
    np.testing.assert_allclose(lengths, [0.8, 1.1, 0.5], rtol=1e-12)


@pytest.mark.slow
def test_a_size_that_is_varied_by_its_path_is_the_cases_own(tmp_path: Path) -> None:
    read = Mcap(export(made(tmp_path, "sizes")).path)
    assert len(read.metadata) == 5
    for case, (length, width, radius) in enumerate([(0.3, 0.1, 40), (0.3, 0.2, 20), (0.4, 0.1, 40), (0.4, 0.2, 20)]):
        drawn = read.entities(f"/case{case}/scene")
        assert drawn[f"case{case}/pointer"].cylinders[0].size.z == pytest.approx(length, rel=1e-12)
        assert drawn[f"case{case}/plate"].cubes[0].size.x == pytest.approx(width, rel=1e-12)
        assert drawn[f"case{case}/boom"].cylinders[0].size.y == pytest.approx(2e-3 * radius, rel=1e-12)


@pytest.mark.slow
def test_the_file_says_what_made_it(reaches: tuple[ArchiveFile, Mcap]) -> None:
    file, read = reaches
    (name, about), (_, case) = read.metadata[:2]
    assert (name, read.library) == ("met.export", "MET 0.1.0")
    assert about["archive"] == "picker.reaches.h5" and about["arm"] == "picker" and about["base_frame"] == "world"
    assert about["deck"] == file.deck
    assert {"met", "version_met", "version_numpy", "git_commit", "git_dirty"} < set(about)
    assert case == {
        "prefix": "case2/",
        "run": "reaches",
        "case": "2",
        "case_id": str(file.groups[0].values("case_id")[2]),
        "case_key": str(file.groups[0].values("case_key")[2]),
        "varied.reach": "0.5 m",
    }
    assert read.attachments == file.sources() != {}


def test_how_a_case_went_is_logged_and_its_result_is_there_once(pick: tuple[ArchiveFile, Mcap]) -> None:
    file, read = pick
    group = file.groups[0]
    fast = float(group.values("fast")[0])
    log = [
        (message.time, message.data.Level.Name(message.data.level), message.data.name, message.data.message)
        for message in read.of("/log")
    ]
    second, case_id = 1_000_000_000, group.values("case_id")[0]
    assert log == [
        (0, "INFO", "pick", f"case #0 {case_id[:8]}"),
        (second, "INFO", "pick", "reached its end"),
        (second, "INFO", "pick", "require up < 1 m: met (up = 0.05 m)"),
        (second, "WARNING", "pick", f"require fast < 0.1 rad/s: missed (fast = {fast:.4g} rad/s)"),
    ]
    [message] = read.of("/result")
    found = message.data
    assert (message.time, message.schema) == (second, "met.result")
    assert (found.case, found.case_id, found.status, found.cause, found.valid_rows) == (0, case_id, "done", "", 51)
    assert found.metrics.up == group.values("up")[0] and found.metrics.fast == fast
    assert [(each.text, each.outcome) for each in found.requirements] == [
        ("up < 1 m", "met"),
        ("fast < 0.1 rad/s", "missed"),
    ]
    assert read.channels["/result"].metadata == {"unit.up": "m", "unit.fast": "rad/s"}


@pytest.mark.slow
def test_a_case_that_failed_ends_where_it_failed_and_says_why(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    monkeypatch.setattr(engine, "run", partial(plans.answer, fails=frozenset({1})))
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    read = Mcap(export("a.h5", cases=[1]).path)
    assert [message.time for message in read.of("/tf")] == [40_000_000 * row for row in range(5)]
    [failed] = [message for message in read.of("/log") if message.data.level == message.data.ERROR]
    assert failed.time == 200_000_000
    assert failed.data.message == "failed: t = 0.2 s: joint elbow: D is not above 0 kg m^2, so qdd is undefined."
    [result] = read.of("/result")
    assert (result.data.status, result.data.valid_rows) == ("failed", 5)
    assert np.isnan(result.data.metrics.settle)
    assert [(v.name, v.value, v.unit) for v in result.data.varied] == [
        ("gearbox.kp", 0.025, "V*s/rad"),
        ("links.lower.mass", 20.1, "kg"),
    ]
    assert {each.outcome for each in result.data.requirements} == {"unknown"}


@pytest.mark.slow
def test_a_case_that_failed_before_its_first_row_has_no_frames(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(*arguments: object, **options: object) -> object:
        found = plans.answer(*arguments, **options)  # type: ignore[arg-type]
        found.n_valid[:] = 0
        found.status[:] = 3
        return found

    plans.answering(monkeypatch)
    monkeypatch.setattr(engine, "run", lost)
    batch.run(plans.plan(), output="a.h5")
    read = Mcap(export("a.h5").path)
    assert read.of("/tf") == [] and len(read.of("/scene")) == 1
    assert [message.time for message in read.of("/result")] == [0]


@pytest.mark.slow
def test_structures_of_one_sweep_have_fields_of_their_own(tmp_path: Path) -> None:
    read = Mcap(export(made(tmp_path, "links", CHAIN)).path)
    assert {"/case0/qd", "/case1/qd", "/case2/qd", "/case3/qd"} < read.topics()
    fields = {
        topic: [field.name for field in read.of(topic)[0].data.DESCRIPTOR.fields]
        for topic in read.topics()
        if topic.endswith("/qd")
    }
    assert sorted(fields.values()) == [["one"], ["one"], ["one", "two"], ["one", "two"]]
    assert len({schema.name for schema in read.schemas.values()}) == len(read.schemas)  # none is two things


def test_signals_of_one_kind_share_one_schema(reaches: tuple[ArchiveFile, Mcap]) -> None:
    _, read = reaches
    assert len({read.channels[f"/case{case}/q"].schema_id for case in range(3)}) == 1
    assert len({(schema.name, schema.data) for schema in read.schemas.values()}) == len(read.schemas)


@pytest.mark.slow
def test_a_link_that_is_called_world_leaves_the_name_to_it(tmp_path: Path) -> None:
    deck = CHAIN.replace("first", "world")
    read = Mcap(export(made(tmp_path, "swing", deck)).path)
    assert [(each.parent_frame_id, each.child_frame_id) for each in read.of("/tf")[0].data.transforms] == [
        ("base", "world")
    ]
    assert read.metadata[0][1]["base_frame"] == "base"


@pytest.mark.slow
def test_positions_may_be_recorded_joint_by_joint(tmp_path: Path, pick: tuple[ArchiveFile, Mcap]) -> None:
    read = Mcap(export(made(tmp_path, "apart")).path)
    assert [str(message.data) for message in read.of("/tf")] == [str(message.data) for message in pick[1].of("/tf")]


@pytest.mark.slow
def test_without_positions_there_is_no_arm_to_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made(tmp_path, "blind")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(Problem) as caught:
        export("picker.blind.h5")
    assert said(caught.value) == (
        "error[E370]: the arm of case #0 of `blind` cannot be shown: swing.q, roll.q, point.q, pan.q was not recorded\n"
        " = help: `record = [q, ...]` in the run keeps where its joints are; then run it again\n"
        " = help: `met export picker.blind.h5 -o FILE.csv` needs no positions\n"
        "\n1 error\n"
    )
    assert not (tmp_path / "picker.blind.mcap").exists()
    assert export("picker.blind.h5", form="csv").rows == 51


@pytest.mark.slow
def test_a_case_without_a_history_is_run_again_first(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(plans.gains(4)), output="a.h5", histories="#1")
    with pytest.raises(Problem) as caught:
        export("a.h5", cases=["#2"])
    assert said(caught.value) == (
        "error[E328]: no history of case #2 of `gains` was kept\n"
        " = help: `met run a.h5 --case '#2'` runs it again, to the same bits, into an archive of its own\n"
        "\n1 error\n"
    )
    assert Mcap(export("a.h5").path).metadata[1][1]["case"] == "1"


@pytest.mark.slow
def test_too_many_cases_for_one_scene_are_refused_unless_named(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(plans.gains(9)), output="a.h5")
    with pytest.raises(Problem) as caught:
        export("a.h5")
    assert said(caught.value) == (
        "error[E372]: 9 cases of `gains` are too many to show over one another\n"
        " = help: `--case '#0' --case '#1'` shows these over one another\n"
        " = help: `met show a.h5` lists the cases, the worst first\n"
        "\n1 error\n"
    )
    assert export("a.h5", cases=range(9)).cases == 9


@pytest.mark.slow
def test_runs_are_overlaid_under_their_names(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(plans.nominal(), plans.gains(3)), output="a.h5")
    assert Mcap(export("a.h5").path).metadata[1][1]["run"] == "nominal"  # the first one
    read = Mcap(export("a.h5", force=True, runs=["gains", "nominal"], cases=["#0"]).path)
    assert {"/gains/case0/qd", "/nominal/case0/qd"} < read.topics()
    assert {message.data.name for message in read.of("/log")} == {"gains/case0", "nominal/case0"}


def rewritten(archive: Path, old: str, new: str) -> None:
    """The archive with another plan in it."""
    import h5py

    with h5py.File(archive, "r+") as file:
        plan = file["provenance/plan"].asstr()[()]
        assert old in plan
        file["provenance/plan"][()] = plan.replace(old, new)


def test_a_plan_that_does_not_tell_the_arm_is_told_of(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(), output="a.h5")
    rewritten(Path("a.h5"), '"elbow.at.x"', '"elbow.at.w"')
    with pytest.raises(Problem) as caught:
        export("a.h5")
    assert said(caught.value) == (
        "error[E302]: the archive a.h5 is damaged\n"
        " = help: an archive that MET writes has its name only when it is whole: was this one copied in part?\n"
        "\n1 error\n"
    )
    assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]


@pytest.mark.slow
def test_a_shape_of_a_later_met_is_drawn_as_none(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(), output="a.h5")
    rewritten(Path("a.h5"), '"rod"', '"cone"')
    [upper] = [entity for name, entity in Mcap(export("a.h5").path).entities("/scene").items() if name == "upper"]
    assert [(point.x, point.y, point.z) for point in upper.lines[0].points] == [(0, 0, 0), (2, 0, 0)]


@pytest.mark.slow
def test_the_same_archive_gives_the_same_bytes(pick: tuple[ArchiveFile, Mcap], tmp_path: Path) -> None:
    first, second = (export(pick[0].path, tmp_path / name).path for name in ("a.mcap", "b.mcap"))
    assert first.read_bytes() == second.read_bytes()


class _Numbers:
    """What has x, y, z and w, as foxglove's vectors and quaternions have."""

    def __init__(self, x: float, y: float, z: float, w: float = 1.0) -> None:
        self.x, self.y, self.z, self.w = x, y, z, w


def _ends(cylinder: object) -> np.ndarray:
    """Centres of a cylinder's faces, in its frame."""
    pose = matrix(cylinder.pose.position, cylinder.pose.orientation)  # type: ignore[attr-defined]
    half = cylinder.size.z / 2.0  # type: ignore[attr-defined]
    return np.array([(pose @ [0, 0, end, 1])[:3] for end in (-half, half)])


@pytest.mark.slow
def test_a_link_with_a_mesh_is_triangles_in_its_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("box.stl").write_bytes(binary_stl(box((1.0, 2.0, 3.0))))
    mesh = ';  mesh = placed("box.stl", at = [1, 0, 0] m); }'
    text = MESHED.replace("; }", mesh, 1)
    batch.run(ic.compile(text=text), output="a.h5")
    assert cli.main(["export", "a.h5"]) == 0
    assert capsys.readouterr().err == "note: meshes of 1 link: 12 triangles, 0.2 kB\n"
    drawn = Mcap(Path("a.mcap")).entities("/scene")["bar"]
    (triangles,) = drawn.triangles
    points = np.array([(p.x, p.y, p.z) for p in triangles.points])[list(triangles.indices)].reshape(-1, 3, 3)
    sides = box((1.0, 2.0, 3.0)) + np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(np.sort(points, axis=0), np.sort(sides, axis=0), atol=1e-6)
    assert len(drawn.cubes) == 0 and len(drawn.cylinders) == 1  # of the joint
    assert cli.main(["export", "a.h5", "--no-meshes", "-q"]) == 0
    plain = Mcap(Path("a.mcap")).entities("/scene")["bar"]
    assert len(plain.triangles) == 0 and len(plain.cubes) == 1
    assert cli.main(["export", "a.h5", "--no-meshes", "-o", "a.csv"]) == 2
    assert capsys.readouterr().err == (
        "error[E375]: an MCAP file draws the arm, and a.csv is none\n = help: leave `--no-meshes` out\n\n1 error\n"
    )
