"""The protocol between controllers and coordinator, and whether it does what the central net does."""
