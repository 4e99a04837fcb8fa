"""A run or sweep as a functional mock-up unit (FMU): FMI 3.0 for co-simulation.

variables    of an FMU: what it takes and gives
description  the XML files
package      the C sources, the binary and the archive of them all;  assets/ has the C that is the same in every FMU
"""
