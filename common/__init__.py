"""The floor below everything: errors, progress, files, pages. It knows nothing of rigs."""
