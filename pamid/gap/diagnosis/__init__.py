"""The answer: verdict, place, closure, remainder, next experiment."""
