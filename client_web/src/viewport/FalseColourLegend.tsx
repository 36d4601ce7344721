import { falseColour } from "../state/display";
/** What the false colours mean: stops about middle grey. The colours are the shader's. */

const STEPS = [
  ["#050505", "< −6"],
  ["#381a73", "−6"],
  ["#1f4dbf", "−4"],
  ["#1a99a6", "−2"],
  ["#737373", "0"],
  ["#59b340", "+½"],
  ["#f2cc26", "+2"],
  ["#e6591a", "+4"],
  ["#ffffff", "> +6"],
] as const;

export function FalseColourLegend() {
  if (!falseColour.value) return null;
  return (
    <div class="legend" aria-label="False colours, stops about middle grey">
      {STEPS.map(([colour, label]) => (
        <span key={label}>
          <i style={{ background: colour }} />
          {label}
        </span>
      ))}
      <span class="unit">stops</span>
    </div>
  );
}
