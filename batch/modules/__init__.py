"""Descriptions of experiments' WebAssembly modules, for programs and pages that run them."""
