"""Pictures of a diagnosis, each a function that draws into a figure of its own or on given axes."""
