"""A study run live: tracker and phone in, a steady display out, a log that replays.

`study_run` and `session` decide everything and touch nothing: no socket, file, clock or randomness. `loop` hands them
events and carries out their actions, `journal` alone writes files, `adapters` and `server` bring bytes in and out.
"""
