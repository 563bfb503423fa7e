"""Current control and modulation, from I_ref to what the legs of the inverter are told: one way a file.

`reference` gives the phase currents that are asked for; ELF takes them as they are, as far as the voltage reaches. A
modulator that switches commands a switch in each leg. `hysteresis` looks at the current errors, and says when it will next
do so: HF takes its look in `twins.hf`, the time of the next in `events.step_to_event`. `carrier` knows its edges beforehand:
HF takes them from peak to peak in `twins.carried`, ELF+ the voltages that they give in `averaged`.
"""
