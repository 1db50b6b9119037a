"""Work that is shared out: to processes of this machine, or to the tasks of a Ray cluster.

What is done is a `Service`: a function of a module, by name, made once a process. What it is done to are `Task`s, plain
JSON. So nothing but JSON goes from process to process, the same service works here, in processes and on a cluster, and
whoever writes one decides nothing about where it runs. A task must be idempotent: it may be done twice where a process
or a machine dies.
"""

from vico.jobs.contract import Answer, AnswerHandler, Executor, MessageHandler, Service, Task
from vico.jobs.executors import Helper, open_executor

__all__ = [
    "Answer",
    "AnswerHandler",
    "Executor",
    "Helper",
    "MessageHandler",
    "Service",
    "Task",
    "open_executor",
]
