"""A run or sweep for simulation elsewhere: as a WebAssembly module with its description, and as a page.

beside       another archive or a measured log beside a page
page         an archive's run or sweep as one HTML page, with its scripts and style in `assets/`
files        the files: their places, and writing them
"""
