"""Guides, which command several joints together, one a file. To add one: write its file, add it to `GUIDES`."""

from met.guides import resolved_rate, together
from met.guides.guide import Guide

GUIDES: tuple[Guide, ...] = (
    resolved_rate.GUIDE,
    together.GUIDE,
)
