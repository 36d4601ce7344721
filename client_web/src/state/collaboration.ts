/** The room of this tab: its members, and the link that opened it. */
import { computed, effect, signal } from "@preact/signals";
import type { Person } from "../protocol";

/** Key of a scene's room: its id, or a view token that only allows watching. */
export interface JoinState {
  scene: string;
  room: string | null;
  watch: string | null;
  /** The shared look that an empty room starts with. */
  share: string | null;
}

/** The requested room; null when working alone. */
export const joinState = signal<JoinState | null>(null);
export const members = signal<readonly Person[]>([]);
/** This member's number. */
export const selfNumber = signal<number | null>(null);

/** True in a room. */
export const isInRoom = computed(() => selfNumber.value !== null);

/** The other members as rarely changing text; null if alone. */
export const membersText = computed(() => {
  const otherMembers = members.value.filter(({ id }) => id !== selfNumber.value);
  const memberNames = otherMembers.map(({ name, online }) => (online ? name : `${name} (connection lost)`));
  return memberNames.length === 0 ? null : `Together with ${memberNames.join(", ")}`;
});

/** True if opened by a view-only link. */
export const isWatching = computed(() => joinState.value !== null && joinState.value.room === null);

const NAME_KEY = "relume.name";

function loadName(): string {
  try {
    return localStorage.getItem(NAME_KEY) ?? "";
  } catch {
    return ""; // storage is forbidden: the server assigns a name
  }
}

/** The user's name if the server has no logins; empty: assigned by the server. */
export const ownName = signal("");

/** Load the stored name, and store its changes. */
export function trackName(): void {
  ownName.value = loadName();
  effect(() => {
    try {
      localStorage.setItem(NAME_KEY, ownName.value);
    } catch {
      // the name is requested again next time
    }
  });
}

const memberTokenKey = ({ scene, room, watch }: JoinState) => `relume.member.${scene}.${room ?? watch}`;

/** The tab's participant token in a room; null without one. */
export function loadMemberToken(target: JoinState): string | null {
  try {
    return sessionStorage.getItem(memberTokenKey(target));
  } catch {
    return null;
  }
}

export function saveMemberToken(target: JoinState, token: string): void {
  try {
    sessionStorage.setItem(memberTokenKey(target), token);
  } catch {
    // storage is forbidden: a reload becomes a new member, until the old token expires
  }
}
