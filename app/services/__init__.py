"""Services of the application between its parts and its commands: functions that return what they found."""
