"""A run or sweep that simulates elsewhere: as a module of WebAssembly, with what a program must know of it as JSON.

description  what is known of a module's inputs, columns, outputs and cases
files        the two files: their places, and writing them
"""
