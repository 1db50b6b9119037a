"""The only place that talks to a language model: client, structured replies, retries, cache, budget, record, replay.

Everybody else asks for a pydantic record and gets one, or an error that says why not::

    class Shop(BaseModel):
        name: str
        sells: list[str]

    model = LanguageModel(Endpoint.from_environment(), budget=Budget(tokens=50_000))
    shop = model.ask([user("Invent a corner shop in Kallio.")], Shop).value

Any server that speaks ``POST /chat/completions`` will do. The environment names it:

=====================  ================================================================================
``VICO_LLM_BASE_URL``  address up to ``/v1`` (else ``OPENAI_BASE_URL``, else OpenAI's own with its key)
``VICO_LLM_MODEL``     name of the model
``VICO_LLM_KEY``       key, if the server wants one (``OPENAI_API_KEY`` goes to OpenAI's addresses alone)
``VICO_LLM_PRICE``     dollars a million tokens read and written, such as ``0.15,0.60``: needed to limit the cost
``VICO_LLM_RECORD``    file to which every call is appended
``VICO_LLM_REPLAY``    such a file, from which calls are answered instead; no server is needed then
=====================  ================================================================================
"""

from vico.llm.budget import Budget, Usage
from vico.llm.client import LanguageModel, Reply, Sampling
from vico.llm.prompts import Message, system, user
from vico.llm.transport import Connection, Endpoint

__all__ = [
    "Budget", "Connection", "Endpoint", "LanguageModel", "Message", "Reply", "Sampling", "Usage", "system", "user",
]  # fmt: skip
