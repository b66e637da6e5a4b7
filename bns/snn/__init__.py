"""Simulator neural networks (SNN: simulator, never "spiking")."""
