; Plays a run of edges: three ports by three OUTs, one cycle each, at exact cycles.
;
; struct edge *player_sync(struct edge *first, uint8_t tick)
;     Waits for TCNT1L == tick, then plays so that the first OUT falls on the first cycle of the
;     tick SYNC_TICKS later. Interrupts must be off and the tick not have begun.
;     Returns the last edge of the run.
;
; Reading the counter in a loop finds the begin of a tick only to within the loop's 5 cycles. The
; four readings after it fall 8 cycles apart, at the begin of a tick for whoever is last in those
; 5; whoever is earlier reads the old value and is put back by one cycle. After four readings all
; are at the same cycle, whatever interrupt or sleep they came from.

#include <avr/io.h>

#include "edge_layout.h"

.text
.global player_sync

player_sync:
    movw r30, r24
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
2:  nop                         ;      8 cycles a turn, 7 in the last
    nop
    nop
    nop
    nop
    dec  r22
    brne 2b                     ;      2 ticks and one for each turn
play:
    out  _SFR_IO_ADDR(PORTB), r18
    out  _SFR_IO_ADDR(PORTC), r19
    out  _SFR_IO_ADDR(PORTD), r20
    tst  r21                    ; 1
    brne next                   ; 2
    movw r24, r30
    ret
