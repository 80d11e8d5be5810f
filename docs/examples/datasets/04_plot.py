"""Plot forces of all joints over time, with units and legend."""

import matplotlib.pyplot as plt

figure, axes = plt.subplots()
post["reaction"].plot.line(x="time", ax=axes)
figure.savefig("reactions.png")
