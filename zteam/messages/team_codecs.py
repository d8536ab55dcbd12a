"""Makes the codecs of what every robot exchanges, when it is imported: a warm parent does so once for all."""

from zteam.messages import BaseInfo, Clock, Done, LaserScan, Odometry, RobotStatus, TeamStatus, TFMessage, Tick, Twist
from zteam.messages.cdr import prepare

prepare(decoded=(Tick, TeamStatus, Clock, TFMessage, RobotStatus, Odometry, LaserScan, BaseInfo))
prepare(encoded=(Twist, Done, RobotStatus))
