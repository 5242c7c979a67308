//! A simulated depth camera with a clothed, moving person in front of it, and the truth beside it.
