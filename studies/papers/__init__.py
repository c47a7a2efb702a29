"""Results of the papers behind quadctl, computed again: `make papers` writes docs/papers.md. One module per result."""
