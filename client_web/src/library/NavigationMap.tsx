/** The map between fitted materials: any point of it is a material, put onto the selected object. */
import { useEffect, useRef, useState } from "preact/hooks";
import { getMaterialMap, materialAt } from "../net/api";
import type { MaterialMapBody } from "../protocol";
import { selectedMaterial } from "../state/selection";
import { useDrag } from "../ui/drag";
import { attempt, note } from "../ui/toasts";
import { giveTerms, library } from "./library";
import { placeOf, pointOf, rangeOf, type Place } from "./map";

const [WIDTH, HEIGHT] = [288, 180];
const STEP = 0.01;

/** Ask for the newest place only: an answer that a later move has overtaken is dropped. */
function useChoice(range: ReturnType<typeof rangeOf> | null) {
  const newest = useRef(0);
  return async (place: Place) => {
    const target = selectedMaterial.value;
    if (range === null) return;
    if (target === null) return note("Choose a material of the scene first; the map changes it.");
    const asked = ++newest.current;
    const { f0, sigma } = pointOf(place, range);
    await attempt(async () => {
      const terms = await materialAt(f0, sigma);
      if (asked === newest.current) giveTerms(target, "Material map", terms);
    });
  };
}

function Plane({ map, range }: { map: MaterialMapBody; range: ReturnType<typeof rangeOf> }) {
  const places = map.points.map((point) => placeOf(point, range));
  const at = (k: number) => `${(places[k]?.x ?? 0) * WIDTH},${(places[k]?.y ?? 0) * HEIGHT}`;
  const swatches = new Map(library.value.map((material) => [material.id, material]));
  return (
    <>
      {map.triangles.map((corners) => (
        <polygon key={corners.join()} points={corners.map(at).join(" ")} />
      ))}
      {map.points.map((point, k) => (
        <circle
          key={point.id}
          cx={(places[k]?.x ?? 0) * WIDTH}
          cy={(places[k]?.y ?? 0) * HEIGHT}
          r={4}
          fill={swatches.get(point.id)?.swatch ?? "#888"}
        >
          <title>{swatches.get(point.id)?.name ?? point.id}</title>
        </circle>
      ))}
    </>
  );
}

export function NavigationMap() {
  const [map, setMap] = useState<MaterialMapBody | null>(null);
  const [place, setPlace] = useState<Place>({ x: 0.5, y: 0.5 });
  useEffect(() => void attempt(async () => setMap(await getMaterialMap())), []);
  const range = map === null ? null : rangeOf(map.points);
  const choose = useChoice(range);
  const go = (x: number, y: number) => {
    const next = { x: Math.min(1, Math.max(0, x)), y: Math.min(1, Math.max(0, y)) };
    setPlace(next);
    void choose(next);
  };
  const point = (event: PointerEvent & { currentTarget: Element }) => {
    const box = event.currentTarget.getBoundingClientRect();
    go((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  };
  const hand = useDrag({
    begin(event) {
      if (event.button !== 0) return false;
      point(event);
      return true;
    },
    move: point,
  });
  const key = (event: KeyboardEvent) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const size = event.shiftKey ? STEP / 5 : STEP;
    go(place.x + size * (step[0] as number), place.y + size * (step[1] as number));
  };
  if (map === null || range === null) return <p>Loading the map…</p>;
  const { f0, sigma } = pointOf(place, range);
  const words = `reflectance ${(100 * f0).toFixed(1)} %, roughness ${sigma.toFixed(3)}`;
  return (
    <div class="material-map">
      <svg
        viewBox={`-6 -6 ${WIDTH + 12} ${HEIGHT + 12}`}
        tabindex={0}
        role="application"
        aria-label={`Map of materials; arrow keys move the point. Now ${words}`}
        onKeyDown={key}
        {...hand}
      >
        <Plane map={map} range={range} />
        <circle class="here" cx={place.x * WIDTH} cy={place.y * HEIGHT} r={6} />
      </svg>
      <p class="material-map-words">
        {words} <span>→ brighter, ↓ rougher</span>
      </p>
    </div>
  );
}
