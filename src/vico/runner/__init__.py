"""The one way to run anything: agents asked under a deadline or in processes of their own, saved and resumed."""
