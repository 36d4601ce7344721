/** Field of view, near plane and collisions of a camera. */
import { LabeledSlider } from "../../ui/LabeledSlider";
import { setStopsAtWalls, stopsAtWalls } from "./navigation";
import { diagonalOf, MAX_YFOV, MIN_YFOV, withFieldOfView, withNearPlane, type Bounds, type Orbit } from "./orbit";

/** Sliders of the lens. */
export function LensSliders({
  orbit,
  bounds,
  change,
}: {
  orbit: Orbit;
  bounds: Bounds;
  change: (update: (now: Orbit) => Orbit) => void;
}) {
  return (
    <>
      <LabeledSlider
        label="Field of view"
        unit="°"
        title="Vertical"
        value={orbit.yfov}
        minimum={MIN_YFOV}
        maximum={MAX_YFOV}
        scale="log"
        onChange={(yfov) => change((now) => withFieldOfView(now, yfov))}
      />
      <LabeledSlider
        label="Clip near"
        unit="m"
        title="Hide surfaces nearer than this, as a wall in front of a room. Light and shadows stay."
        value={orbit.near}
        minimum={0}
        maximum={Number(diagonalOf(bounds).toPrecision(3))}
        scale="linear"
        onChange={(near) => change((now) => withNearPlane(now, near))}
      />
    </>
  );
}

/** Switch for collisions. */
export function StopAtWalls({ title }: { title: string }) {
  return (
    <label title={title}>
      <input
        type="checkbox"
        checked={stopsAtWalls.value}
        onChange={(event) => setStopsAtWalls(event.currentTarget.checked)}
      />
      Stop at walls
    </label>
  );
}
