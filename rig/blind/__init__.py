"""The blind check: hidden effects are drawn, diagnosed by a process that can't see the answers,
and scored when the answers are opened."""
