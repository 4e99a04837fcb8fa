"""What whoever runs an experiment's module of WebAssembly must know of it, a program or a page."""
