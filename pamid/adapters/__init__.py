"""Adapters: reparametrisations of a trained volume network that turn a model of one muscle into another's."""
