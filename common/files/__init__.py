"""Files: read strictly with one-line errors, written whole or not at all."""
