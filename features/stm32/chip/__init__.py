"""An STM32F103 in integers: its core's exceptions, its peripherals and its time around unicorn's instructions.

Flow: `engine` maps memory and hooks, and calls `processor.run` for a stretch of time. `run` lets unicorn execute blocks
of instructions. Before each block unicorn calls `on_block`, which advances the time by the cost of the block before it
(`cost`), lets the devices that are due act (`devices`), and stops unicorn if an exception is due (`nvic`). Each access
to a peripheral goes to `bus`, which knows the registers by the tables of `registers`, and from there to the module of
the peripheral. What an event brings for timers and DMA1 follows at once (`timer_inputs`, `transfers`). A pin that
changes is written into the list of edges (`gpio`). Devices in Python answer by `outside`.

All state is one array of int64, whose places `cells` names. The functions use the integer subset of Python that numba
compiles: plain Python is the reference.
"""
