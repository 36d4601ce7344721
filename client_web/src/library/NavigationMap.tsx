/** The map between fitted materials: any point of it is a material, put onto the selected object. */
import { useEffect, useRef, useState } from "preact/hooks";
import { getMaterialMap, materialAt } from "../net/api";
import type { MaterialMapBody } from "../protocol";
import { selectedMaterial, terms } from "../state/selection";
import { useDrag } from "../ui/drag";
import { attempt, note } from "../ui/toasts";
import { giveTerms, library } from "./library";
import { highlightOf, placeOf, pointOf, rangeOf, type Place } from "./map";

const [WIDTH, HEIGHT] = [288, 180];
const STEP = 0.01;
const MIDDLE: Place = { x: 0.5, y: 0.5 };

const clamp = (share: number) => Math.min(1, Math.max(0, share));
const inside = ({ x, y }: Place): Place => ({ x: clamp(x), y: clamp(y) });
const wordsOf = ({ f0, sigma }: { f0: number; sigma: number }) =>
  `reflectance ${(100 * f0).toFixed(1)} %, roughness ${sigma.toFixed(3)}`;

/** Ask for the newest place only: an answer that a later move has overtaken is dropped. `done` when none is awaited. */
function useChoice(range: ReturnType<typeof rangeOf> | null, done: () => void) {
  const newest = useRef(0);
  return async (place: Place) => {
    const target = selectedMaterial.value;
    if (range === null) return;
    if (target === null) return note("Choose a material of the scene first; the map changes it.");
    const asked = ++newest.current;
    const { f0, sigma } = pointOf(place, range);
    await attempt(async () => {
      const found = await materialAt(f0, sigma);
      if (asked === newest.current) giveTerms(target, "Material map", found);
    });
    if (asked === newest.current) done();
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
  const [hand, setHand] = useState<Place | null>(null); // until the material has come there
  useEffect(() => void attempt(async () => setMap(await getMaterialMap())), []);
  const range = map === null ? null : rangeOf(map.points);
  const choose = useChoice(range, () => setHand(null));
  const own = highlightOf(terms.value);
  const here = hand ?? (own === null || range === null ? null : inside(placeOf(own, range)));
  const go = (x: number, y: number) => {
    const next = inside({ x, y });
    if (selectedMaterial.peek() !== null) setHand(next);
    void choose(next);
  };
  const point = (event: PointerEvent & { currentTarget: Element }) => {
    const box = event.currentTarget.getBoundingClientRect();
    go((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  };
  const drag = useDrag({
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
    const from = here ?? MIDDLE;
    go(from.x + size * (step[0] as number), from.y + size * (step[1] as number));
  };
  if (map === null || range === null) return <p>Loading the map…</p>;
  const words = here === null ? "no material of the map" : wordsOf(pointOf(here, range));
  return (
    <div class="material-map">
      <svg
        viewBox={`-6 -6 ${WIDTH + 12} ${HEIGHT + 12}`}
        tabindex={0}
        role="application"
        aria-label={`Map of materials; arrow keys move the point. Now ${words}`}
        onKeyDown={key}
        {...drag}
      >
        <Plane map={map} range={range} />
        {here !== null && <circle class="here" cx={here.x * WIDTH} cy={here.y * HEIGHT} r={6} />}
      </svg>
      <p class="material-map-words">
        {words} <span>→ brighter, ↓ rougher</span>
      </p>
    </div>
  );
}
