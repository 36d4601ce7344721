/** Aperture, blades and focus of a camera to bake; its bakes are blurred, the placement viewport is sharp. */
import type { LensBody } from "../../protocol";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { MIN_FOCUS_DISTANCE } from "./orbit";

const MAX_DIAMETER = 200; // mm; larger ones by REST
const MAX_FOCUS_DISTANCE = 1000; // m
const BLADES = [0, 3, 4, 5, 6, 7, 8, 9];

export function DepthOfField({
  lens,
  distance,
  focuses,
  onChange,
  onFocuses,
}: {
  lens: LensBody | null;
  /** Distance of the point in the middle, the first focus. */
  distance: number;
  /** A click in the view sets the focus. */
  focuses: boolean;
  onChange: (lens: LensBody | null) => void;
  onFocuses: (focuses: boolean) => void;
}) {
  const setDiameter = (millimeters: number) =>
    onChange(millimeters === 0 ? null : { focus_distance: distance, ...lens, radius: millimeters / 2000 });
  return (
    <>
      <LabeledSlider
        label="Aperture"
        unit="mm"
        title="Diameter of the lens. 0: everything is sharp. Shown in bakes."
        value={(lens?.radius ?? 0) * 2000}
        minimum={0}
        maximum={MAX_DIAMETER}
        scale="linear"
        onChange={setDiameter}
      />
      {lens !== null && (
        <>
          <LabeledSlider
            label="Focus distance"
            unit="m"
            value={lens.focus_distance}
            minimum={MIN_FOCUS_DISTANCE}
            maximum={MAX_FOCUS_DISTANCE}
            scale="log"
            onChange={(focus_distance) => onChange({ ...lens, focus_distance })}
          />
          <div class="placement-steps">
            <button type="button" aria-pressed={focuses} onClick={() => onFocuses(!focuses)}>
              {focuses ? "Click a surface to focus on it" : "Focus by click"}
            </button>
            <button type="button" onClick={() => onChange({ ...lens, focus_distance: distance })}>
              Focus on center
            </button>
            <label>
              Blades{" "}
              <select
                value={lens.blades ?? 0}
                onChange={(event) => onChange({ ...lens, blades: Number(event.currentTarget.value) })}
              >
                {BLADES.map((blades) => (
                  <option key={blades} value={blades}>
                    {blades === 0 ? "Round" : blades}
                  </option>
                ))}
              </select>
            </label>
          </div>
        </>
      )}
    </>
  );
}
