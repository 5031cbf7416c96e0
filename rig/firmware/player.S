; Plays a run of edges: three ports by three OUTs, one cycle each, at exact cycles.
;
; struct edge *player_sync(struct edge *first, uint8_t tick)
;     Waits for TCNT1L == tick, then plays so that the first OUT falls on the first cycle of the
;     tick SYNC_TICKS later. Interrupts must be off and the tick not have begun.
;     Returns the last edge of the run; NULL when the interlock has opened: no edge after that.
;
; Reading the counter in a loop finds the begin of a tick only to within the loop's 5 cycles. The
; four readings after it fall 8 cycles apart, at the begin of a tick for whoever is last in those
; 5; whoever is earlier reads the old value and is put back by one cycle. After four readings all
; are at the same cycle, whatever interrupt or sleep they came from.
;
; Between the edges of a run the interlock is read at every turn. OPEN_READINGS in a row that say
; open are 4 us and no glitch.

#include <avr/io.h>

#include "board.h"
#include "edge_layout.h"

#define OPEN_READINGS 9

.text
.global player_sync

player_sync:
    movw r30, r24
    ldi  r24, OPEN_READINGS + 1
    ldd  r18, Z + EDGE_B
    ldd  r19, Z + EDGE_C
    ldd  r20, Z + EDGE_D
    ldd  r21, Z + EDGE_WAIT
    mov  r23, r22
    inc  r23
1:  lds  r25, TCNT1L            ; 2    5 cycles a turn
    cp   r25, r22               ; 1
    brne 1b                     ; 2, 1 to leave
.rept 4
    lds  r25, TCNT1L            ; 2    8 cycles when the tick has begun, 9 when not yet
    cpse r25, r23               ; 2 when it has
    rjmp .+0                    ; 1 + 2 when not
    inc  r23                    ; 1
    nop
    nop
    nop
.endr
    rjmp .+0                    ; 8    one tick to the first OUT
    rjmp .+0
    rjmp .+0
    rjmp play

next:                           ;      6 cycles since the first OUT
    adiw r30, EDGE_SIZE         ; 2
    ldd  r18, Z + EDGE_B        ; 2
    ldd  r19, Z + EDGE_C        ; 2
    ldd  r20, Z + EDGE_D        ; 2
    mov  r22, r21               ; 1
    ldd  r21, Z + EDGE_WAIT     ; 2    17 cycles
2:  sbis _SFR_IO_ADDR(PINB), INTERLOCK_BIT ; 8 cycles a turn, 7 in the last
    ldi  r24, OPEN_READINGS + 1 ; 2    both, or past it
    dec  r24                    ; 1
    breq open                   ; 1
    nop                         ; 1
    dec  r22                    ; 1
    brne 2b                     ;      2 ticks and one for each turn
play:
    out  _SFR_IO_ADDR(PORTB), r18
    out  _SFR_IO_ADDR(PORTC), r19
    out  _SFR_IO_ADDR(PORTD), r20
    tst  r21                    ; 1
    brne next                   ; 2
    movw r24, r30
    ret

open:
    ldi  r24, 0
    ldi  r25, 0
    ret
