#!/usr/bin/env python3
"""Writes points.csv, the matrix of a dynamometer: each pressure with each speed, direction and temperature of the pad.
Usage: inputs/dynamometer/make.py > inputs/dynamometer/points.csv"""

LOADS = [50, 100, 200]  # N on the holder
SPEEDS = [5, 20]  # rad/s, each in both directions
TEMPERATURES = {50: (0.33, 5.0e9), 150: (0.38, 4.6e9), 250: (0.34, 4.2e9), 350: (0.26, 3.8e9)}  # degree Celsius: friction, modulus

print("# temperatures, load by load and speed by speed:", *TEMPERATURES, "degree Celsius")
print("numbers.load,numbers.speed,friction.coefficient,part.pin.young")
for load in LOADS:
    for speed in SPEEDS:
        for direction in (1, -1):
            for friction, modulus in TEMPERATURES.values():
                print(f"{load},{direction * speed},{friction},{modulus:g}")
