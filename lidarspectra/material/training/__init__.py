"""How the shipped segmentation model was made: `python -m lidarspectra.material.training`, with the extra `train`."""
