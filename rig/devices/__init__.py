"""From a station to its devices, real and simulated: above both wings, below nobody of them."""
