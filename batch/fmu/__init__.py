"""A run or sweep as a functional mock-up unit (FMU) for co-simulation, of FMI 2.0 or 3.0.

variables    of an FMU: what it takes and gives
description  the XML files
package      the C sources, the binary and the archive of them all;  assets/ has the C that is the same in every FMU
"""
