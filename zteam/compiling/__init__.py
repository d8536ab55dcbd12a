"""Compiles kernels, keeps them, and lets a process run without them until they are there. Imports no compiler."""
