"""The voting protocol: pure machines, the controllers and their coordinator, and the token player in both."""
