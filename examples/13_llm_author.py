"""Have a language model write a town's people, and see what it wrote and what was left to the rules.

python examples/13_llm_author.py --world out/demo/world --residents 4

With VICO_LLM_BASE_URL and VICO_LLM_MODEL it asks that model. Without, a function of this file stands in for one: it
writes characters, poor ones, and refuses groups and days, so those are written by rule.
"""

import argparse
import json
import os
import re
from pathlib import Path
from typing import Any

from vico.community import build_community
from vico.community.llm import LlmCommunityAuthor
from vico.llm import Connection, Endpoint, LanguageModel
from vico.world.folder import read_world


def improvise(endpoint: Endpoint, body: dict[str, Any], timeout: float) -> dict[str, Any]:
    """Answer a request as a server would: any client of your own can stand here."""
    message: dict[str, Any] = {"role": "assistant", "content": "", "refusal": "I only write characters."}
    if body["response_format"]["json_schema"]["name"] == "Characters":
        blocks = re.findall(r'<data name="(\w+)">\n(.*)\n</data>', body["messages"][1]["content"])
        data = {name: json.loads(text) for name, text in blocks}
        people = [character(person) for person in data["people"]]
        message = {"role": "assistant", "content": json.dumps({"characters": people})}
    return {"choices": [{"message": message, "finish_reason": "stop"}]}


def character(person: dict[str, Any]) -> dict[str, Any]:
    """Write somebody's life from what one sees of them."""
    settled = person["settled"] or {"occupation": "freelance clockmaker", "workplace": None}
    where = f" at {settled['workplace']}" if settled["workplace"] else ""
    return {
        "id": person["id"],
        "name": person["suggested_name"],
        **settled,
        "values": ["self-direction", "tradition"],
        "personality": {
            "openness": 60, "conscientiousness": 90, "extraversion": 30, "agreeableness": 60, "neuroticism": 40,
            "traits": ["exact", "shy"],
        },
        "hobbies": ["sundials", "long walks"],
        "lifestyle": "Is never late and never early.",
        "biography": f"{person['suggested_name']} is {settled['occupation']}{where}, and can tell the time by shadows.",
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--residents", type=int, default=4)
    arguments = parser.parse_args()

    if os.environ.get("VICO_LLM_BASE_URL"):
        model = LanguageModel.from_environment()
    else:
        model = LanguageModel(
            Endpoint("http://127.0.0.1:9/v1", "a function"), connection=Connection(transport=improvise)
        )
    author = LlmCommunityAuthor(model)
    community = build_community(read_world(arguments.world), arguments.residents, seed=0, author=author)

    assert community.authorship is not None
    for resident in community.residents:
        print(f"{resident.name}, {resident.age}: {resident.biography}")
    for kind, counts in community.authorship.counts.items():
        print(kind, {origin.value: count for origin, count in counts.items()})
    print("spent:", model.budget.spent)


if __name__ == "__main__":
    main()
