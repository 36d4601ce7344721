"""Graceful shutdown: announce, drain sessions, stop jobs, exit within a bound."""
