"""Does the rig measure the face? Dense reconstruction from captures, comparison with the truth."""
