"""Makes the codecs of what every robot exchanges, when it is imported: a warm parent does so once for all."""

from zteam import messages as m

for kind in (m.BaseInfo, m.Clock, m.Done, m.LaserScan, m.Odometry, m.RobotStatus, m.TeamStatus, m.TFMessage, m.Tick):
    m.decode(kind, m.encode(kind()))
m.encode(m.Twist())
