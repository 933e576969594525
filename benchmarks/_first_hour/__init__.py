"""What a user has in the first hour: a simulator of a robot or a plant, and a log in the names of its driver."""
