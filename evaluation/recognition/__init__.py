"""Does the data of a rig suffice to recognise a person: 3D faces, after Spreeuwers (2011)."""
