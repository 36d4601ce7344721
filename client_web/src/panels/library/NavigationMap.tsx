/** The navigation map of fitted materials: each point is a material, applied to the selected object. */
import { useEffect, useRef, useState } from "preact/hooks";
import { getMaterialMap, getMaterialAt } from "../../session/net/api";
import type { MaterialMapBody } from "../../protocol";
import { selectedMaterial, selectedTerms } from "../../state/selection";
import { useDrag } from "../../ui/drag";
import { reportErrors, showNote } from "../../ui/toasts";
import { applyTerms, library } from "./libraryItems";
import { highlightOf, positionOf, highlightAt, mapRange, type MapPosition } from "./navigationMap";

const [WIDTH, HEIGHT] = [288, 180];
const STEP = 0.01;
const MIDDLE: MapPosition = { x: 0.5, y: 0.5 };

const clamp = (fraction: number) => Math.min(1, Math.max(0, fraction));
const clampToPlane = ({ x, y }: MapPosition): MapPosition => ({ x: clamp(x), y: clamp(y) });
const highlightText = ({ f0, sigma }: { f0: number; sigma: number }) =>
  `reflectance ${(100 * f0).toFixed(1)} %, roughness ${sigma.toFixed(3)}`;

/** Request only the newest point: a response superseded by a later move is dropped. `done` when none is pending. */
function useMaterialChoice(range: ReturnType<typeof mapRange> | null, done: () => void) {
  const newest = useRef(0);
  return async (point: MapPosition) => {
    const target = selectedMaterial.value;
    if (range === null) return;
    if (target === null) return showNote("Select a material in the scene first.");
    const requestNumber = ++newest.current;
    const { f0, sigma } = highlightAt(point, range);
    await reportErrors(async () => {
      const material = await getMaterialAt(f0, sigma);
      if (requestNumber === newest.current) applyTerms(target, "Material map", material);
    });
    if (requestNumber === newest.current) done();
  };
}

function MapPlane({ map, range }: { map: MaterialMapBody; range: ReturnType<typeof mapRange> }) {
  const positions = map.points.map((point) => positionOf(point, range));
  const coordinatesOf = (k: number) => `${(positions[k]?.x ?? 0) * WIDTH},${(positions[k]?.y ?? 0) * HEIGHT}`;
  const swatches = new Map(library.value.map((material) => [material.id, material]));
  return (
    <>
      {map.triangles.map((corners) => (
        <polygon key={corners.join()} points={corners.map(coordinatesOf).join(" ")} />
      ))}
      {map.points.map((point, k) => (
        <circle
          key={point.id}
          cx={(positions[k]?.x ?? 0) * WIDTH}
          cy={(positions[k]?.y ?? 0) * HEIGHT}
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
  const [pendingPoint, setPendingPoint] = useState<MapPosition | null>(null); // until the material is applied
  useEffect(() => void reportErrors(async () => setMap(await getMaterialMap())), []);
  const range = map === null ? null : mapRange(map.points);
  const choose = useMaterialChoice(range, () => setPendingPoint(null));
  const currentHighlight = highlightOf(selectedTerms.value);
  const position =
    pendingPoint ??
    (currentHighlight === null || range === null ? null : clampToPlane(positionOf(currentHighlight, range)));
  const go = (x: number, y: number) => {
    const next = clampToPlane({ x, y });
    if (selectedMaterial.peek() !== null) setPendingPoint(next);
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
    const from = position ?? MIDDLE;
    go(from.x + size * (step[0] as number), from.y + size * (step[1] as number));
  };
  if (map === null || range === null) return <p>Loading the map…</p>;
  const valueText = position === null ? "Not on the map" : highlightText(highlightAt(position, range));
  return (
    <div class="material-map">
      <svg
        viewBox={`-6 -6 ${WIDTH + 12} ${HEIGHT + 12}`}
        tabindex={0}
        role="application"
        aria-label={`Material map; arrow keys move the point. Now ${valueText}`}
        onKeyDown={key}
        {...drag}
      >
        <MapPlane map={map} range={range} />
        {position !== null && <circle class="here" cx={position.x * WIDTH} cy={position.y * HEIGHT} r={6} />}
      </svg>
      <p class="material-map-text">
        {valueText} <span>right: more reflective, down: rougher</span>
      </p>
    </div>
  );
}
