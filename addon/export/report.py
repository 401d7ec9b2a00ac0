"""What an export tells its caller beside the arrays: warnings, errors, and that it was stopped."""

from __future__ import annotations


class ExportError(Exception):
    """The frame cannot be rendered; the message tells the user what to do."""


class ExportStopped(Exception):
    """`should_stop` became true: the user pressed Esc."""


class Warnings:
    """Messages for the user in the order they arose, each once."""

    def __init__(self) -> None:
        self._messages: dict[str, None] = {}

    def add(self, name: str, message: str) -> None:
        """Say `message` about the object, material or image called `name`."""
        self._messages.setdefault(f"'{name}': {message}")

    def not_rendered(self, name: str, what: str) -> None:
        """Say that `what` is missing from the picture of `name`."""
        self.add(name, f"{what} is not rendered yet")

    def add_all(self, others: Warnings) -> None:
        """Say what others say."""
        for message in others.messages():
            self._messages.setdefault(message)

    def messages(self) -> list[str]:
        return list(self._messages)
