"""Aided navigation: error model, Kalman filter, measurements, smoother (paper 003 and beyond)."""
