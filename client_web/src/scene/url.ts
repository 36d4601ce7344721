/** A place in the editor as the address says it. */

export interface Place {
  scene: string | null;
  bake: string | null;
  view: string | null;
  /** The views that are shown side by side; empty where one is shown alone. */
  beside: string[];
  material: string | null;
  term: number;
  curve: string | null;
  light: string | null;
  /** What opens the room that the look is shared in, to edit or only to watch. */
  room: string | null;
  watch: string | null;
  /** The shared look that it begins with. */
  share: string | null;
}

export function placeFromUrl(search: string): Place {
  const query = new URLSearchParams(search);
  return {
    scene: query.get("scene"),
    bake: query.get("bake"),
    view: query.get("view"),
    beside: query.getAll("beside"),
    material: query.get("material"),
    term: Math.max(0, Math.trunc(Number(query.get("term") ?? 0)) || 0),
    curve: query.get("curve"),
    light: query.get("light"),
    room: query.get("room"),
    watch: query.get("watch"),
    share: query.get("share"),
  };
}

export function placeToUrl(place: Place): string {
  const query = new URLSearchParams();
  for (const key of ["scene", "bake", "view", "material", "curve", "light", "room", "watch"] as const) {
    if (place[key] !== null && place[key] !== "") query.set(key, place[key]);
  }
  for (const view of place.beside) query.append("beside", view);
  if (place.material !== null && place.term > 0) query.set("term", String(place.term));
  return query.size > 0 ? `?${query.toString()}` : "/";
}
