"""The version of MET; setup.cfg takes it from here."""

VERSION = "0.1.0"
