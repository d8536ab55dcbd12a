/** Keys of the map, for the help dialogue. */

/** @type {{keys: string, text: string, group: string}[]} */
export const SHORTCUTS = [
  { keys: "s", text: "Select: click, Shift+click adds, Shift+drag a box; drag moves the map", group: "Tools" },
  { keys: "g", text: "Goal for the selected robots: press, drag for the heading", group: "Tools" },
  { keys: "p", text: "Initial pose of the selected robot: press, drag for the heading", group: "Tools" },
  { keys: "v", text: "Move a robot in the simulator: drag it, wheel turns it", group: "Tools" },
  { keys: "r", text: "Measure: press and drag", group: "Tools" },
  { keys: "d", text: "Drive the selected robot with keys, stick or gamepad", group: "Tools" },
  { keys: "Ctrl+A", text: "Select all robots", group: "Tools" },
  { keys: "Esc", text: "Stop what goes on; back to Select; leave a field; then: cancel the goals of the selected robots", group: "Tools" },
  { keys: "wheel, + −", text: "Zoom", group: "View" },
  { keys: "Shift+wheel, [ ]", text: "Turn the map", group: "View" },
  { keys: "middle drag, arrows", text: "Move the map", group: "View" },
  { keys: "right drag", text: "Turn the map", group: "View" },
  { keys: "f, Home", text: "Show the whole map", group: "View" },
  { keys: "Shift+F", text: "Follow the selected robot with the view", group: "View" },
  { keys: "n", text: "Reset the rotation: x to the right", group: "View" },
  { keys: "Tab", text: "To the map: now arrows move a cursor on it", group: "Cursor" },
  { keys: "arrows, Shift + these", text: "Move the cursor by 16 pixels, by 2", group: "Cursor" },
  { keys: "Enter", text: "Use the tool there: select the robot, set the goal", group: "Cursor" },
  { keys: "Space", text: "Press there: arrows give the heading, Enter releases", group: "Cursor" },
  { keys: "u i o, j l, m , .", text: "Forwards, turn, backwards (also the arrows)", group: "Driving" },
  { keys: "Shift + these", text: "Sideways, for omnidirectional robots", group: "Driving" },
  { keys: "q z, w x, e c", text: "Faster and slower: both, only speed, only turn rate", group: "Driving" },
  { keys: "k, space", text: "Stop", group: "Driving" },
  { keys: "Tab", text: "Stop, next robot", group: "Driving" },
];
