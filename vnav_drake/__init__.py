"""Planning with velocity constraints: the problem, the methods and what they return."""
