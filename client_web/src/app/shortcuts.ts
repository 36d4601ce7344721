/** Everything that has a key: the keyboard and the help page read the same list. */
import { beginComment } from "../panels/collaboration/commentActions";
import { logarithmic, curveTool } from "../curve/curveView";
import { editValue } from "../edit/edit";
import { storeA, saveLook, swapWithA, toggleWipe } from "../panels/looks/abCompare";
import { exportPng } from "../panels/looks/exportImage";
import { redo, undo } from "../panels/looks/undoRedo";
import { zoomActual, zoomBy, zoomFit } from "../render/zoom";
import { toggleSolo } from "../state/visibility/soloSources";
import { falseColor, handlesOpen, isReferenceShown, wipe } from "../state/display";
import { look } from "../state/look";
import { filmstripOpen, helpOpen, histogramOpen, inspectorOpen, scenePanelOpen, timelineOpen } from "../state/panels";
import { togglePlay } from "../panels/timeline/playback";
import { toggleSideBySide } from "../state/views";

export interface Shortcut {
  group: "Picture" | "Look" | "Compare" | "Curve" | "Panels";
  label: string;
  /** `KeyboardEvent.key`, with "Ctrl+" and "Shift+" in front where they matter. */
  keys: string[];
  run(): void;
  /** For keys that act while they are held. */
  release?(): void;
}

const THIRD_STOP = 1 / 3;

function changeExposure(stops: number): void {
  const exposure = look.value?.display.exposure ?? 0;
  editValue("Exposure", "/display/exposure", Number((exposure + stops).toFixed(6)));
}

function moveWipe(delta: number): void {
  if (wipe.value.isOn) wipe.value = { isOn: true, position: Math.min(1, Math.max(0, wipe.value.position + delta)) };
}

function toggleAllPanels(): void {
  const open = !(scenePanelOpen.value || inspectorOpen.value || filmstripOpen.value);
  scenePanelOpen.value = inspectorOpen.value = filmstripOpen.value = open;
}

export const SHORTCUTS: readonly Shortcut[] = [
  { group: "Picture", label: "Zoom in", keys: ["+", "="], run: () => zoomBy(1.25) },
  { group: "Picture", label: "Zoom out", keys: ["-"], run: () => zoomBy(1 / 1.25) },
  { group: "Picture", label: "Fit", keys: ["f"], run: zoomFit },
  { group: "Picture", label: "One to one", keys: ["1"], run: zoomActual },
  { group: "Picture", label: "Views side by side", keys: ["v"], run: toggleSideBySide },
  { group: "Picture", label: "False colour", keys: ["e"], run: () => (falseColor.value = !falseColor.value) },
  { group: "Picture", label: "Histogram", keys: ["h"], run: () => (histogramOpen.value = !histogramOpen.value) },
  { group: "Picture", label: "Selected material or light alone", keys: ["s"], run: toggleSolo },
  { group: "Picture", label: "Handles of lights", keys: ["g"], run: () => (handlesOpen.value = !handlesOpen.value) },
  { group: "Picture", label: "Darker by ⅓ stop", keys: [","], run: () => changeExposure(-THIRD_STOP) },
  { group: "Picture", label: "Brighter by ⅓ stop", keys: ["."], run: () => changeExposure(THIRD_STOP) },
  { group: "Look", label: "Undo", keys: ["Ctrl+z"], run: undo },
  { group: "Look", label: "Redo", keys: ["Ctrl+Shift+z", "Ctrl+y"], run: redo },
  { group: "Look", label: "Save the look", keys: ["Ctrl+s"], run: () => void saveLook() },
  { group: "Look", label: "Export PNG", keys: ["Ctrl+Shift+s"], run: () => void exportPng() },
  { group: "Look", label: "Time line", keys: ["m"], run: () => (timelineOpen.value = !timelineOpen.value) },
  { group: "Look", label: "Play or pause the time line", keys: ["k"], run: togglePlay },
  { group: "Compare", label: "Keep this picture as A", keys: ["a"], run: storeA },
  { group: "Compare", label: "Swap A and B", keys: ["x"], run: swapWithA },
  { group: "Compare", label: "Wipe between A and B, the live picture", keys: ["w"], run: toggleWipe },
  { group: "Compare", label: "Move the wipe", keys: ["[", "]"], run: () => undefined },
  {
    group: "Compare",
    label: "Show A while held",
    keys: ["c"],
    run: () => (isReferenceShown.value = true),
    release: () => (isReferenceShown.value = false),
  },
  { group: "Curve", label: "Points", keys: ["p"], run: () => (curveTool.value = "points") },
  { group: "Curve", label: "Draw", keys: ["d"], run: () => (curveTool.value = "draw") },
  { group: "Curve", label: "Scale and shift a stretch", keys: ["t"], run: () => (curveTool.value = "stretch") },
  { group: "Curve", label: "Logarithmic values", keys: ["l"], run: () => (logarithmic.value = !logarithmic.value) },
  { group: "Picture", label: "Comment on the pixel under the pointer", keys: ["n"], run: beginComment },
  { group: "Panels", label: "Only the picture", keys: ["\\"], run: toggleAllPanels },
  { group: "Panels", label: "These keys", keys: ["?"], run: () => (helpOpen.value = !helpOpen.value) },
];

/** Keys of controls that have the focus; listed, handled where they belong. */
export const FOCUS_KEYS: readonly (readonly [label: string, keys: readonly string[]])[] = [
  ["Slider: step", ["←", "→"]],
  ["Slider: large step", ["Page Up", "Page Down"]],
  ["Slider: ends", ["Home", "End"]],
  ["Slider: fine steps", ["Shift+←", "Shift+→"]],
  ["Slider: type a number", ["Enter", "0–9"]],
  ["Slider: reset", ["Delete"]],
  ["Curve point: angle", ["←", "→"]],
  ["Curve point: value by 2 %", ["↑", "↓"]],
  ["Curve point: value by 25 %", ["Page Up", "Page Down"]],
  ["Curve point: fine steps", ["Shift+arrow"]],
  ["Curve point: pick up, put down", ["Enter"]],
  ["Curve point: delete", ["Delete"]],
  ["Curve point: reset", ["R"]],
  ["Stretch: scale", ["↑", "↓"]],
  ["Stretch: shift", ["←", "→"]],
  ["Handle of a light: select", ["Enter", "Space"]],
  ["Handle of a light: move", ["←", "→", "↑", "↓"]],
  ["Handle of a light: away, near", ["Shift+↑", "Shift+↓"]],
  ["Pin of a new comment: move", ["←", "→", "↑", "↓"]],
  ["Pin of a new comment: by ten", ["Shift+arrow"]],
  ["Picture: pan, or turn its eye", ["←", "→", "↑", "↓"]],
  ["Eye: slide", ["Shift+arrow"]],
  ["Eye: nearer, farther", ["+", "−"]],
  ["Eye: back", ["Home"]],
  ["One of several views: show it alone", ["Enter"]],
];

export function handleWipeKey(key: string): void {
  moveWipe(key === "[" ? -0.02 : 0.02);
}
