"""Measures of granular samples: arrays in, numbers out. Knows neither engines nor files."""
