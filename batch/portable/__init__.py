"""A run or sweep that simulates elsewhere: as a module of WebAssembly with its description, and as a page.

description  what is known of a module's inputs, columns, outputs and cases
page         an archive's run or sweep as one HTML page, with its scripts and style in `assets/`
files        the files: their places, and writing them
"""
