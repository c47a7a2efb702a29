"""What the papers behind quadctl print, computed again: `make papers` writes docs/papers.md. One module per result."""
