"""How the shipped segmentation model was made: `python -m research.training`, with the extra `train`."""
