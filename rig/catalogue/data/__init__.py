"""The catalogue's data files: one TOML file per kind of part."""
