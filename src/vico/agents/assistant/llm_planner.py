"""The LLM planner: a language model chooses what to do next (paper, section "Baselines": modules as in CoELA).

- **Perception**: what pictures showed of what the tasks are about (`SeenMemory`).
- **Memory**: previous actions with what came of them, the progress of each task as the book keeps it, what was said.
- **Planning**: the model is given all that and the numbered actions (`Book.choices`), and replies with a number.
- **Communication**: of two assistants who are near each other each may say a few lines before it decides.
- **Execution**: the same errands as all planners have.

Prompts are data (``data/prompts/assistant``). A reply can do nothing but choose one of the available actions, and a
line is only said. Where the model gives nothing of use the planner takes the nearest open choice, its own share of the
tasks first, and notes a fault of the kind ``model``.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from vico.agents.assistant.choosing import EPISODE, ChoicePlanner
from vico.agents.assistant.errands import Choice
from vico.agents.assistant.planner_briefing import Briefing, clock
from vico.agents.assistant.planner_memory import ActionMemory, progress_of
from vico.agents.assistant.planner_replies import PlannedAction, SpokenMessage
from vico.agents.assistant.planner_talk import Talk
from vico.agents.assistant.skills import Action, ObservationView
from vico.agents.model_access import ModelAccess, episode_tokens, model_from_environment
from vico.agents.navigation.memory import SeenThing
from vico.agents.state import AgentState
from vico.llm import LanguageModel
from vico.llm.prompts import read_prompt
from vico.world.public import PublicMap

log = logging.getLogger(__name__)

#: What is done where the model gives nothing of use.
FALLBACK = "nearest open choice"


class LlmPlanner(ChoicePlanner):
    """Asks a language model at each decision.

    Parameters
    ----------
    model
        Whom to ask; None: the one that the environment names, shared by all planners of the process.

    Raises
    ------
    InputError
        If the environment names no model, or one that can't be used.
    """

    method = "llm"

    def __init__(
        self,
        instructions: list[dict[str, Any]],
        public_map: PublicMap,
        *,
        seed: int,
        number: int = 0,
        of: int = 1,
        distance: bool = True,
        model: LanguageModel | None = None,
    ) -> None:
        super().__init__(instructions, public_map, seed=seed, number=number, of=of, distance=distance)
        self.access = ModelAccess(model or model_from_environment(method=self.method), limit=episode_tokens())
        self.name = f"assistant_{number}"
        colleague = f"assistant_{1 - number}" if of > 1 else ""
        people = [told["person"]["agent"] for told in instructions if told["category"] == "carry"]
        self.talk = Talk(self.name, colleague, begins=number == 0, also=people)
        self.actions = ActionMemory()
        self._briefing = Briefing(self.book, self.skills, self.estimates)
        self._plan = read_prompt("assistant", "plan_two" if colleague else "plan", PlannedAction)
        self._message = read_prompt("assistant", "message", SpokenMessage)
        self._last: Choice | None = None
        self._instead: Action | None = None  # of a choice, in this step

    @property
    def tokens(self) -> int:
        """Tokens spent."""
        return self.access.tokens

    @property
    def cost(self) -> float:
        """US dollars spent."""
        return self.access.cost

    @property
    def model_faults(self) -> list[tuple[int, str]]:
        """Each time the model was of no use: the step, and why."""
        return self.access.faults

    def state(self) -> AgentState:
        """Return what is under way, and all that is known and was said."""
        last = self._last
        return super().state() | {
            "access": self.access.state(),
            "talk": self.talk.state(),
            "actions": self.actions.state(),
            "last": None if last is None else [last.kind, last.subtask, last.region],
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        super().restore(state)
        self.access.restore(state["access"])
        self.talk.restore(state["talk"])
        self.actions.restore(state["actions"])
        self._last = None
        if state["last"] is not None:
            kind, subtask, region = state["last"]
            self._last = Choice(kind, int(subtask), int(region))

    def notice(self, view: ObservationView) -> None:
        """Take in what is said."""
        self.talk.hear(view, clock(float(view.state["time"])))

    def decide(self, view: ObservationView) -> Choice | None:
        """Return what the model chooses; None where something is said first, or nothing is left to do."""
        now = float(view.state["time"])
        if self._last is not None:
            self.actions.end(self._last, clock(self.actions.since), now, self.book)
            self._last = None
        seen = self.seen(view)
        choices = self.book.choices(view, seen)
        if not choices:
            return None
        self._instead = self.talk.next(view, self.skills, clock(now), lambda: self._line(view))
        if self._instead is not None:
            return None
        choice = self._chosen(view, choices, seen)
        self.talk.decided()
        self.actions.begin(self._briefing.words(choice), now, self.book)
        self._last = choice
        return choice

    def idle(self, view: ObservationView) -> Action:
        """Return what the conversation asks for, else wait."""
        action, self._instead = self._instead, None
        return action or {"type": "wait"}

    def _step(self, view: ObservationView) -> int:
        assert self.began is not None
        return round(float(view.state["time"]) - self.began) + 1

    def _chosen(self, view: ObservationView, choices: list[Choice], seen: Mapping[int, SeenThing]) -> Choice:
        """Return the choice of the model; where there is one alone it is not asked."""
        if len(choices) == 1:
            return choices[0]

        def check(reply: PlannedAction) -> list[str]:
            if 1 <= reply.action <= len(choices):
                return []
            return [f"action: {reply.action} is none of the available actions; give a number from 1 to {len(choices)}"]

        told = self._told(view) | {"actions": self._briefing.actions(view, choices, seen)}
        reply = self.access.ask(self._plan, PlannedAction, told, step=self._step(view), check=check)
        if reply is None:
            return self._nearest(view, choices, seen)
        log.debug("%s chooses action %d: %s", self.name, reply.action, reply.reason[:200])
        return choices[reply.action - 1]

    def _nearest(self, view: ObservationView, choices: list[Choice], seen: Mapping[int, SeenThing]) -> Choice:
        """Return the nearest choice, of this assistant's share if there is any; the first where all are as near."""
        here = [float(x) for x in view.pose[:2]]
        mine = [choice for choice in choices if choice.subtask in self.mine] or choices
        return min(mine, key=lambda choice: self.estimates.travel(here, self._briefing.goal(choice, seen)))

    def _line(self, view: ObservationView) -> str | None:
        """Return what the model has the assistant say."""
        reply = self.access.ask(self._message, SpokenMessage, self._told(view), step=self._step(view))
        return None if reply is None else reply.message

    def _told(self, view: ObservationView) -> dict[str, Any]:
        """Return the inputs that planning and speaking have in common."""
        assert self.began is not None
        held = self._held(view)
        state = self._briefing.state(view, left=self.time_left(view), held=self._hands(view))
        told: dict[str, Any] = {
            "name": self.name,
            "end": clock(self.began + EPISODE),
            "tasks": self._briefing.tasks(),
            "locations": self._briefing.locations(view),
            "state": state,
            "progress": progress_of(self.book, held),
            "previous": self.actions.entries,
        }
        if self.talk.colleague:
            state["colleague"] = self.talk.seen(view, self.skills) or {"name": self.talk.colleague, "near": False}
            told |= {"colleague": self.talk.colleague, "conversation": self.talk.conversation.lines}
        return told

    def _held(self, view: ObservationView) -> dict[int, list[str]]:
        """Return the names of what is in hand, by subtask."""
        entities = {entity for entity in view.held if entity}
        return {
            k: names
            for k, told in self.book.instructions.items()
            if (names := [name for name in told["objects"] if self.book.picked.get(name) in entities])
        }

    def _hands(self, view: ObservationView) -> list[str]:
        """Return what each hand holds."""
        names = {entity: name for name, entity in self.book.picked.items()}
        return [names.get(entity, "a thing") if entity else "free" for entity in view.held]
