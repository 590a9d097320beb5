"""G-code: words, blocks, moves and paths of the tool."""
