"""Example models for MET, one a file; docs/models.md explains them."""
