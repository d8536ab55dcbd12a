"""The pytest plugin with the `team` fixture, and what its tests use (public: `zteam.testing`)."""
