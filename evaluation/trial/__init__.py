"""Whether a rig measures a face: photographed, reconstructed and compared, all in the computer."""
